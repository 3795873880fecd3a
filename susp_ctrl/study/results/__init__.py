"""What was computed: data classes without any computation, and the file that keeps them."""

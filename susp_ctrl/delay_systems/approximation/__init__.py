"""What an ordinary state-space system would say: Padé and spectral approximations of the delays."""

"""How each part of a study is computed from its settings."""

"""Messages to arrays and back, checked once."""

"""What is called on the command line."""

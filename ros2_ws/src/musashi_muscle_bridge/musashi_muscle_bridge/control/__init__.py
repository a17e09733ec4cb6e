"""Who commands a muscle; the control loop and its process."""

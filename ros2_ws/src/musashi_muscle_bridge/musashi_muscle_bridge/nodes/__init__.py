"""The bridge, the mock driver, the monitor and the arm's markers."""

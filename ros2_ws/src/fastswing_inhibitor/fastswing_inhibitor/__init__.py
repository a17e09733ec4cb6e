"""Method 1 of the paper: zero current on fast antagonists while the arm swings."""

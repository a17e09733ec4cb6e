"""A bag published again."""

"""The arm's shapes and muscles as markers."""

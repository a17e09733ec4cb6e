"""What an analysis shows: text, record, pictures and page."""

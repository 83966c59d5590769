"""The report: its figures and tables, and its page in a real browser."""

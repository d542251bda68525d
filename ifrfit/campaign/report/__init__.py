"""Campaigns as a table, an index page and a text for the terminal."""

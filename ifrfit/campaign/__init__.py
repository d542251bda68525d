"""Campaigns: thousands of groups of impacts, each fitted by itself, then as members of one population."""

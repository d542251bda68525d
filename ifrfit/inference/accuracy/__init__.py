"""As exact as asked, or as exact as the time allows: method and settings picked, and what they reached."""

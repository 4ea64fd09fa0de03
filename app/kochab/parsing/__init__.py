"""What people type and files hold, read with care: angles, sites, places, text and JSON of others."""

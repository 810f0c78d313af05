"""A cache as one HTML page: what is drawn, packed, and the page around it."""

"""From runs to better physics: parameters fitted to measured motion, and what the data say about them."""

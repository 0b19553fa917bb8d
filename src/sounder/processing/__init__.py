"""From recordings to products: one position, many positions, and what is wrong with them."""

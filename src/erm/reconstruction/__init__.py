"""Environment reconstruction: from MPCs to the walls and poles that reflected them."""

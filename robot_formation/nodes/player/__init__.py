"""The player node: a bag's topics and its clock."""

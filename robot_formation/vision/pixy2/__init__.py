"""A Pixy2 in software: teaching colours, finding blocks of them and tracking the blocks."""

"""What sub-commands share: the line and its options, the terminal, how far work is, and the answer."""

"""What a reader of a verdict is to be warned of: records with numbers (`caution`), and who makes them."""

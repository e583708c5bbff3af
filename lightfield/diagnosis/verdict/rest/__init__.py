"""What nothing explains: along which coordinate it lies, and which local unknown describes it."""

"""Does the diagnosis name an effect in numbers that are no measurement? Tables of garbage, judged."""

"""Any number of effects: sets of them as nodes with a price, fitted, compared and remembered."""

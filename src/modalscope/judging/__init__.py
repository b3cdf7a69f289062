"""Floor 4: poles of all orders, and which of them are modes."""

"""Drawing levels: a plan read off a distribution once, draws column by column, placement without overlap."""

"""From data to effects: which effects the scene of the data calls for, and which one a misfit does."""

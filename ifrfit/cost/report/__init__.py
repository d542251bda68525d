"""How measured costs are shown: text, sentences, figures and the folder that holds them."""

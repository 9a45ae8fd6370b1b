"""What a scene does not need: rewrites of its model, each with its condition, its strength and its reason in words."""

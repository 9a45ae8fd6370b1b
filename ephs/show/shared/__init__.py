"""Colours, figures, pages and errors of all pictures.

Nothing comes in; the other rooms of pictures take these. Start with `palette`.
"""

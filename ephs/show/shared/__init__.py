"""What all pictures share: colours, figures, pages, and their errors.

Nothing comes in; the other rooms of pictures take these. Start with `palette`.
"""

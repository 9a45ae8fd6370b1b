"""The compiled engine of mechanisms in joint coordinates: articulated bodies, loops closed where they meet."""

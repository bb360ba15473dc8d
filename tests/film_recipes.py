"""Texts of recipes that several tests begin with."""

GRID = "wavelengths = { start = 450, stop = 750, step = 4 }"
SILICON = '"3.9+0.02j"'


def film_recipe(data: str, *layers: str, substrate: str = SILICON, end: str = "") -> str:
    """The text of a recipe with these lines under [data], of each layer, and at its end."""
    tables = "".join(f"\n[[scene.layer]]\n{layer}\n" for layer in layers)
    return f"[data]\n{data}\n\n[scene]\nsubstrate = {substrate}\n{tables}\n{end}"


CONTRAST = film_recipe(
    f'signal = "contrast"\n{GRID}',
    'name = "flake"\nmaterial = "2.6+1.3j"\nthickness = { lower = 0.1, upper = 20, value = 3.35 }',
    'name = "oxide"\nmaterial = 1.46\nthickness = 285',
    end=f"[reference]\nsubstrate = {SILICON}\nlayer = [{{ material = 1.46, thickness = 285 }}]\n",
)
TRANSMISSION = film_recipe(
    f'signal = "psi-delta"\ntransmission = true\nangle = 60\n{GRID}',
    'material = "2.1+0.01j"\nthickness = { lower = 10, upper = 400, value = 180 }',
    substrate="1.52",
)

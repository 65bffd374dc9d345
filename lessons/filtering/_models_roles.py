"""Names and colours of the three models, in the order of the bank."""

from lessons.kit.roles import Role

NAMES = ("stand", "drive", "turn")
ROLES: tuple[Role, Role, Role] = ("linearised", "kf", "likelihood")   # three colours that can be told apart

"""Names that a reader knows, for families, algorithms, designs, variations and groups of factors as tables name them."""

FAMILIES = {
    "empty": "Empty",
    "objectsx1": "Objects",
    "tilesx1": "Tiles of 2022",
    "hazardtilesx1": "Hazard tiles",
}
ALGORITHMS = {
    "ppo": "PPO of the paper",
    "ppo_fast": "PPO",
    "ppo_fast_five_epochs": "PPO, more gradient steps",
    "ppo_two_epochs": "PPO, more gradient steps",
    "ppo_recurrent": "PPO with a memory",
    "curl_fast": "PPO with CURL",
    "curl": "PPO with CURL",
    "spr_fast": "PPO with SPR",
    "spr": "PPO with SPR",
    "drac_fast": "PPO with augmented frames (DrAC)",
    "drac": "PPO with augmented frames (DrAC)",
    "ppg_fast": "PPO in phases (PPG)",
    "ppg": "PPO in phases (PPG)",
    "drq": "SAC with shifts (DrQ)",
    "drq_2022": "SAC with shifts (DrQ), as in 2022",
    "sac": "SAC",
}
DESIGNS = {
    "iid": "independent",
    "clustered": "near together",
    "covering": "far apart",
    "nuisance_only": "one level ten times",
    "matched": "like independent sets",
    "matched_far": "farther in W2",
    "matched_sparse": "worse coverage",
    "matched_far_sparse": "both",
}
VARIATIONS = {
    "the default": "default physics",
    "ball_heavy": "heavy ball",
    "gravity_range": "gravity of a range",
    "gravity_2.5": "gravity 2.5",
    "gravity_40": "gravity 40",
    "friction_0.2": "friction 0.2",
    "friction_0.8": "friction 0.8",
    "frictionless": "no friction",
    "without_fields": "no fields",
    "fields_r2": "magnetism by 1/r²",
    "baseline": "base textures",
    "close": "close textures",
    "far": "far textures",
}
PLAYERS = {"oracle": "planner", "scripted": "script", "floor": "better of idle and random"}
GROUPS = {"position": "where things are", "properties": "their properties", "rest": "what they are"}


def family_name(name: object) -> str:
    """The family in words; its own name where there are none."""
    return FAMILIES.get(str(name), str(name))


def panel_name(panel: object) -> str:
    """A panel in words, such as ``Hazard tiles, hard``."""
    family, _, difficulty = str(panel).partition("-")
    return ", ".join(filter(None, (family_name(family), difficulty)))


def algorithm_name(name: object) -> str:
    """The algorithm in words; its own name where there are none."""
    return ALGORITHMS.get(str(name), str(name))


def design_name(name: object) -> str:
    """The design of training sets in words; its own name where there are none."""
    return DESIGNS.get(str(name), str(name))


def variation_name(name: object) -> str:
    """The change of physics or of textures in words; its own name where there are none."""
    return VARIATIONS.get(str(name), str(name))


def player_name(name: object) -> str:
    """The player without training in words; its own name where there are none."""
    return PLAYERS.get(str(name), str(name))


def group_name(name: object) -> str:
    """The group of factors in words; its own name where there are none."""
    return GROUPS.get(str(name), str(name))

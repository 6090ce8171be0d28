"""Names that a reader knows, for what tables name: families, algorithms, designs, variations, players, groups of factors."""

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
WORDS = FAMILIES | ALGORITHMS | DESIGNS | VARIATIONS | PLAYERS | GROUPS


def word_for(name: object) -> str:
    """What a table names, in words; its own name where there are none."""
    return WORDS.get(str(name), str(name))


def panel_name(panel: object) -> str:
    """A panel in words, such as ``Hazard tiles, hard``."""
    family, _, difficulty = str(panel).partition("-")
    return ", ".join(filter(None, (word_for(family), difficulty)))

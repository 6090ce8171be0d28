"""The language in which a person writes worlds: values, factors, entities, relations, rules, tasks; and what reads it."""

"""The paper's claims: what each says, what these runs say of it, and the verdict.

``statements.yaml`` has the words of all claims, ``gap``, ``information`` and ``learning`` have their tests, ``reading`` puts
both together, ``evidence`` has the statistics, and ``verdicts`` the rules. This room imports results, stats and tables.
"""

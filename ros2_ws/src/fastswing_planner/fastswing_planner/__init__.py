"""Fast swings of redundant tendon-driven arms: muscle model, holding, swing, mask, elongation.

The equations are those of Kawaharazuka et al., "Exceeding the Maximum Speed Limit of the Joint
Angle for the Redundant Tendon-driven Structures of Musculoskeletal Humanoids" ("the paper").
"""

"""Reactions: what joints, guides and contacts carry."""

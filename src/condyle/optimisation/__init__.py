"""Motions worth making: paths between poses, chewing from key poses."""

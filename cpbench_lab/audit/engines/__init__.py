"""Engines that `cpbench audit` knows, one file each."""

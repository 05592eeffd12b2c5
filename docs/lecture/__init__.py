"""The tutorial: Acary's lecture on one page, every number and picture computed by cpbench while the page is built."""

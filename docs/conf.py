"""How Sphinx makes the site of the pages that `python docs/generate` writes, with no file from elsewhere."""

project = "cpbench"
html_title = "cpbench"
language = "en"
extensions = ["myst_parser"]
myst_heading_anchors = 4  # links of pages name headings, as on any host of Markdown
html_theme = "pydata_sphinx_theme"
html_theme_options = {
    "header_links_before_dropdown": 6,
    "navigation_with_keys": False,
    "secondary_sidebar_items": {"*": ["page-toc"], "*/*": ["page-toc"]},
}  # pages of commands, further down, have no second sidebar, so that long lines are seen whole
html_context = {"default_mode": "auto"}  # light or dark, as the browser has it
html_show_sourcelink = False
html_copy_source = False
html_extra_path = ["whole"]  # the tutorial is a page as it stands
exclude_patterns = ["whole"]

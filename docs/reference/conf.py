"""Settings of Sphinx; render.py runs it."""

project = "eulerfsi"
extensions = ["breathe", "sphinx.ext.autodoc"]
exclude_patterns = []
html_theme = "alabaster"
html_theme_options = {"page_width": "75rem", "fixed_sidebar": True}
html_show_sourcelink = False
html_copy_source = False
default_role = "code"

breathe_default_project = "eulerfsi"
breathe_projects = {}
breathe_domain_by_extension = {"h": "c"}

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
add_module_names = False

# Types without an entry: those of C and of other packages, and those of this one that only pass through.
nitpick_ignore_regex = [
    ("c:identifier", r"u?int\d+_t|size_t"),
    ("py:class", r"(?!eulerfsi\.).*"),
    ("py:class", r"eulerfsi\.(log\.Log|run\.build\.Build|scene\.parts\.Scene|solver\.c_api\.MeshView)"),
]

"""Editors: a language server for urbiscript (docs/editors.md), ``urbihw lsp``.

Reading order: ``problems`` (what the parser says of a text, in the columns of editors), ``textmate`` (the words of the
language as a grammar for editors), ``server`` (the messages).  Only ``server`` imports the package pygls, of the extra
``lsp``.
"""

"""The page to try it: `results` finds what it shows and knows no Gradio, `page` lays it out, `server` serves it."""

"""The app in a real Chromium.  Everything waits for conditions, as rendering by software may be slow."""

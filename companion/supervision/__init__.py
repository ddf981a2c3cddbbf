"""What may begin, bound or end a run: arming, localization, fences, batteries, shutdown."""

"""The small vocabulary that lessons are written in: parameters, scene, figures, lesson."""

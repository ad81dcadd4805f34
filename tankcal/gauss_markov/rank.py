def diagnosis(work, state, bad):
    return f"todo {bad}"

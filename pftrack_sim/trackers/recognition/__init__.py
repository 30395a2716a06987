"""How a target looked, by which an estimate is judged and a lost target is found again."""

"""What stands along streets: furniture, barriers, lights, poles, signs and signals."""

"""Objects along streets: furniture, barriers, lights, poles, signs and traffic lights."""

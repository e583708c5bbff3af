"""The library as a user meets it: functions named as the commands, answers that draw and table themselves."""

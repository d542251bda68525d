"""The population that groups come from: pooled in part, and what speaks against one."""

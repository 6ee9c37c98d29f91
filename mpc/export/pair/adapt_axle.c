            believe(params);

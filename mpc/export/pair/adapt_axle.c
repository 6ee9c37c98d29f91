            params->max_slip[0] = useful_slip(params->weights, 0U);
            params->max_slip[1] = useful_slip(params->weights, 1U);

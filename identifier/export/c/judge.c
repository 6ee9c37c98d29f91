    if (!@name@_believed(&next, input)) {
        status = @NAME@_IMPLAUSIBLE;
    }

/* The status that a sample's checks give: 0, that of the first that fails for sure, or AGAIN. */
INLINE int judged(const double *check) {
    int status = 0;
    for (int i = 0; i < CHECKS; i++) {
        if (check[i] >= tolerance[i]) continue;
        int own = check[i] < 0 ? below[i] : AGAIN;
        if (status == 0 || (status == AGAIN && own != AGAIN)) status = own;
    }
    return status;
}
